"""What a file is, what it holds, and how to begin one."""
