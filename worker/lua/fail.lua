-- ARGV: id, attempt, error. → 1, or 0: fenced.
local id, attempt = ARGV[1], ARGV[2]
if get(id, 'status') == 'failed' and get(id, 'attempt') == attempt then return 1 end
if not holds(id, attempt) then return 0 end
redis.call('HSET', job(id), 'error', ARGV[3])
finish(id, 'failed')
return 1
