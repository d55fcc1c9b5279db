"""Numbers of tasks that the language and its file formats share."""

LOWEST_PRIORITY = 31  # 0 is the highest; a task without PRIORITY has this one
