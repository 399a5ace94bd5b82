"""Contact search: cell list, neighbour lists."""
