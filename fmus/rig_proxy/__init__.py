"""The rig proxy: takes the place of a component and forwards its signals to the real rig."""
