-- ARGV: id, attempt, stage, progress, stage that ended ('': none), its seconds. → 1, or 0: fenced.
local id = ARGV[1]
if not holds(id, ARGV[2]) then return 0 end
redis.call('HSET', job(id), 'stage', ARGV[3], 'progress', ARGV[4])
if ARGV[5] ~= '' then observe(get(id, 'kind'), ARGV[5], tonumber(ARGV[6])) end
event(id)
return 1
