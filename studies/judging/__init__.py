"""Studies of a diagnosis over hundreds of records: draw, diagnose, judge, write a page.

The pages are in ``docs``.
"""
