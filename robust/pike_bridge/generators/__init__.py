"""Plans with choices: the paper's examples, and families of random ones."""
