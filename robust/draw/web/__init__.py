"""What pages in a browser consist of: HTML, styles and scripts, put into one file by :mod:`robust.draw.interactive`."""
