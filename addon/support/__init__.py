"""What everything else stands on: files that are whole or not there, memory, long calls on threads of their own.

files            files that are whole or not there; paths of each system
memory           what is free, and refusals of what needs more
background_work  a long call on a thread of its own
"""
