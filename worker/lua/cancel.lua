-- ARGV: id. → status before, or nil: no such job. A running horse is stopped by its worker, which is fenced now.
local id = ARGV[1]
local status = get(id, 'status')
if status == 'queued' or status == 'running' then finish(id, 'canceled') end
return status
