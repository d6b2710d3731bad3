"""The subcommands of ``kohonen-adapt``: read arguments and files, call the library, write files and lines."""
