"""What holds trees up: rods, their wood, loads and stability."""
