"""Every operator and function over operands : specs whose states, rewards, ends and observations hold the results."""
