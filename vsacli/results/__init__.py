"""Files that come out, and figures of them."""
