"""Plugins of a rig: backends of hardware and a bridge, each on a library of an extra.

A rig is served without them: the server finds its backends by entry points, as those of anybody.
"""
