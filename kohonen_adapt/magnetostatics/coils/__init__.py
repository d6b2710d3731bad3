"""Coils in space with closed forms of their fields."""
