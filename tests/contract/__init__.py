"""One module for each line of the FMU contract; every line holds for both components and both builds."""
