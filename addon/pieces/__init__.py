"""Long work over frames as files of some frames each, which are recognised when it is run again.

piece  which frames and files belong together, what their bytes depend on, and the manifests that say what is done
work   the work itself, at once or in steps, and what came of it
"""
