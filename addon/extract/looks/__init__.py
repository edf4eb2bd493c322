"""What surfaces and the environment look like: materials and their nodes, images, lights, the world."""
