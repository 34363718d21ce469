"""What can be baked, one channel a file."""
