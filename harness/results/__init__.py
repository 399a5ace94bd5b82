"""What runs leave: the schema of stored results, the store, and what is made of it."""
