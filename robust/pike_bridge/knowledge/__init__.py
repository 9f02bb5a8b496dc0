"""Knowledge bases over finite-domain variables, behind one interface."""
