"""Long work over frames as files of some frames each, which are recognised when it is run again.

piece  chunks of frames and files, the inputs of their bytes, and the manifests of finished ones
work   the work itself, at once or in steps, and its outcome
"""
