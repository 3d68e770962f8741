"""From a task to a trained policy: configurations, run directories, evaluation, learners."""
