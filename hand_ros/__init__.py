"""What every node shares: the life of a node and its declared parameters."""
