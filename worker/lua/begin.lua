-- ARGV: id, token of this run, worker, seconds of lease. → attempt, or nil: there is nothing to do.
local id, token = ARGV[1], ARGV[2]
local status = get(id, 'status')
if status == 'running' and get(id, 'token') == token then return get(id, 'attempt') end
if status ~= 'queued' then return nil end
local at = now()
if tonumber(redis.call('ZSCORE', P .. 'queued:' .. get(id, 'queue'), id) or '0') > at then return nil end
if get(id, 'attempt') == '0' then observe(get(id, 'kind'), 'queued', at - tonumber(get(id, 'created_at'))) end
local attempt = redis.call('HINCRBY', job(id), 'attempt', 1)
let_go(id)
redis.call('HSET', job(id), 'status', 'running', 'stage', 'starting', 'progress', '0', 'started_at', text(at),
  'token', token, 'worker', ARGV[3])
redis.call('ZADD', P .. 'running', text(at + tonumber(ARGV[4])), id)
event(id)
return tostring(attempt)
