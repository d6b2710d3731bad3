"""What the subcommands of ``kohonen-adapt`` do, without a word to the terminal."""
