"""Methods that others wrote: engines that own their particles and their step, each in an environment of its own."""
