"""What every node shares: the life of a node, and the byte layout of the messages."""
