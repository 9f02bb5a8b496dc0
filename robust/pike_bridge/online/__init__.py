"""The executive of plans with choices: recognise intent and adapt to it while the plan is carried out [PIKE §3]."""
