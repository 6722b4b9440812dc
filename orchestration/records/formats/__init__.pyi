from .registry import read_table as read_table
