"""The plant behind the board protocol: the simulation node, the offline plant, the board emulator."""
