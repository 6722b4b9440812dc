"""Studies beside the product: the thesis recomputed, an emulated rig, plants, records, judges."""
