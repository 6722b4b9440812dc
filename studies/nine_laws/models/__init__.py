"""The models of the plants, which lack what is hidden and list other effects."""
