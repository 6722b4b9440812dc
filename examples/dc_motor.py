"""A DC motor and a polypyrrole actuator that hold the same load: the free integrator of eq. 5.1.

Run it anywhere: ``python examples/dc_motor.py``; it draws ``dc_motor.png``.
"""

from pathlib import Path

from demonstrations.thesis.motor import DcMotor, Maxwell, figure
from orchestration.reporting.pictures import save

LOAD = 2.75  # N, the largest of the thesis

motor, muscle = DcMotor(), Maxwell()
print(f"{LOAD:g} N, no electrical drive: displacement after")
for seconds in (0.01, 1.0, 60.0, 600.0):
    spool, film = (1e3 * float(body.displacement(LOAD, seconds)) for body in (motor, muscle))
    print(f"  {seconds:6g} s   motor {spool:10.4g} mm   actuator {film:6.3f} mm")
volts, watts = motor.holding(LOAD)
print(
    f"the motor resists for {1e3 * motor.time_constant:.0f} ms; to hold it needs {volts:.2f} V and"
    f" {watts:.2f} W"
)
print(
    f"the actuator is a spring for {muscle.time_constant:.0f} s, then it flows: it has a free"
    " integrator too"
)
save(figure(), Path("dc_motor.png"))
print("drew dc_motor.png")
