"""Pictures and pages: the only folder that imports matplotlib or networkx."""
