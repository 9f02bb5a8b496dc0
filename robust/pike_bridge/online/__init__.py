"""The executive of plans with choices: recognising intent and adapting to it while the plan is carried out [PIKE §3]."""
