"""What light does to a sensor's beams: from the rays of a beam to the echoes that are reported."""
