"""Contact search: cell list, neighbour lists; contacts of NURBS outlines."""
