"""Inputs of each component where tools are compared.

No communication point meets a sample: there tools differ in what is read, and where inputs jump in
what is sampled.
"""

# stop time and step; mean, amplitude and angular frequency of what is fed
STIMULI = {
    "ppy_actuator": (20.0, 0.37, {"current": (0.0, 0.3, 0.9), "force": (0.5, 0.3, 0.5)}),
    "ppy_actuator_length_driven": (
        20.0,
        0.37,
        {"current": (0.0, 0.3, 0.9), "length_change": (5e-5, 1e-4, 0.5)},
    ),
    "ppy_actuator_voltage_driven": (
        20.0,
        0.37,
        {"voltage": (0.0, 0.3, 0.9), "force": (0.5, 0.3, 0.5)},
    ),
    "galvanostat": (
        0.5,
        0.00171,
        {"current_command": (0.0, 2.0, 30.0), "voltage": (0.0, 3.0, 40.0)},
    ),
    "voice_coil_dma": (
        0.5,
        0.0007,
        {"force_reference": (1.0, 0.5, 20.0), "tension": (0.6, 0.3, 20.0)},
    ),
    "degradation_estimator": (
        5.0,
        0.0371,
        {"current": (0.0, 0.3, 0.9), "voltage": (0.0, 0.5, 0.8)},
    ),
    "foot": (
        1.0,
        0.013,
        {
            "an_tension": (10.0, 5.0, 3.0),
            "ankle_angle": (0.0, 0.3, 2.0),
            "mtp_angle": (0.1, 0.1, 4),
        },
    ),
    "displacement_controller": (
        2.0,
        0.00371,
        {"reference": (1e-5, 1e-5, 20.0), "voltage": (0.1, 0.8, 3.0), "current": (0.0, 0.3, 3.0)},
    ),
    "state_feedback": (
        2.0,
        0.00371,
        {"reference": (1e-5, 1e-5, 20.0), "voltage": (0.1, 0.2, 3.0), "force": (0.1, 0.1, 3.0)},
    ),
    "feedforward": (
        20.0,
        0.0371,
        {"next_reference": (1e-4, 1e-5, 0.7), "next_force": (0.5, 0.1, 0.5)},
    ),
    "learning_controller": (
        30.0,
        0.0371,
        {"reference": (1e-5, 1e-5, 0.7), "displacement": (0.0, 1e-5, 0.5)},
    ),
    "impedance_controller": (
        2.0,
        0.00371,
        {"length": (5e-4, 5e-4, 7.0), "rest_length": (1e-4, 1e-4, 3.0)},
    ),
    "adaptive_controller": (
        3.5,
        0.00371,
        {"reference": (3e-5, 3e-5, 2.0), "displacement": (2e-5, 2e-5, 1.9)},
    ),
    "pid": (1.0, 0.00371, {"reference": (1.0, 0.5, 20.0), "measured": (0.8, 0.5, 7.0)}),
    "foot_design": (1.0, 0.013, {"ankle_angle": (0.0, 0.3, 2.0), "mtp_angle": (0.1, 0.1, 4)}),
    "foot_dynamic": (1.0, 0.013, {"an_tension": (20.0, 20.0, 3.0), "po_tension": (5.0, 5.0, 7.0)}),
    "isotonic_stand": (2.0, 0.0137, {"mass": (0.1, 0.05, 3.0), "displacement": (1e-4, 1e-4, 5.0)}),
    "foot_displacement_driven": (
        0.3,
        0.0047,
        # held in the air: after an impact of taut springs the solvers of two tools give up
        {"an_displacement": (-2e-4, 2e-4, 3.0), "leg_force_y": (2.9, 0.2, 7.0)},
    ),
    "foot_free": (0.3, 0.0047, {"an_tension": (2.0, 2.0, 3.0), "leg_force_y": (0.0, 0.5, 7.0)}),
}
