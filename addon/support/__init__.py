"""What everything else stands on: files that are whole or not there, memory, long calls on threads of their own."""
