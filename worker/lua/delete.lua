-- ARGV: id. → ids of the children, to be deleted next. Their files and this job's go to the sweep.
return forget(ARGV[1])
