"""The polypyrrole actuator, force-driven and length-driven."""
