"""Pages that are made from the code at each build, so that they cannot fall behind it."""
