"""What surfaces and surroundings look like: materials and their nodes, images, lights, the world."""
