-- ARGV: id, attempt, seconds of lease. → 1, or 0: fenced.
local id = ARGV[1]
if not holds(id, ARGV[2]) then return 0 end
redis.call('ZADD', P .. 'running', text(now() + tonumber(ARGV[3])), id)
redis.call('HDEL', job(id), 'suspect')
return 1
