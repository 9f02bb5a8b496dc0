"""What theorem modules are written with, and what checks them."""
