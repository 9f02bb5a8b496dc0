"""Plans and problems that only experiments use: each is decided by its size and its seed."""
