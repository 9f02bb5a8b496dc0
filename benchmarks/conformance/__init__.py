"""What executives of plans with choices must do, as files, and plans with what is known of them; see README.md."""
