from .experiment import design_experiment as design_experiment
