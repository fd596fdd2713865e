-- ARGV: id, attempt, files, metrics, last stage, its seconds. → 1: this attempt is the published one, or 0: fenced.
local id, attempt = ARGV[1], ARGV[2]
if get(id, 'status') == 'succeeded' and get(id, 'attempt') == attempt then return 1 end
if not holds(id, attempt) then return 0 end
redis.call('HSET', job(id), 'files', ARGV[3], 'metrics', ARGV[4], 'stage', 'done', 'progress', '100')
if ARGV[5] ~= '' then observe(get(id, 'kind'), ARGV[5], tonumber(ARGV[6])) end
finish(id, 'succeeded')
return 1
