"""One engine for all experiments: tasks become records, records become tables and figures, text, JSON and Markdown."""
