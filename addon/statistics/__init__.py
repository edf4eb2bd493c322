"""What the last image of each scene cost, in one place, and as rows that panels show."""
