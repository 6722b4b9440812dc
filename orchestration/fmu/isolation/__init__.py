"""FMUs in a process beside this one: whatever they do to it, it is told in a line, and what they computed is kept.

A whole simulation, run or part of a sweep goes on there, so that nothing crosses between processes at a step. What an
FMU is doing, and how far it is, stands in memory that outlives its process.
"""
