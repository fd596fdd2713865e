-- What every transition shares. One script is one transaction: Redis runs nothing else meanwhile.
-- Keys are derived from ids, so the records live on one Redis (or one primary with replicas), not on a cluster.
local P = 'matphys:'
local EVENTS = 512       -- newest events kept of a job
local ZOMBIE_S = 60      -- how long a fenced attempt may still write before its files are swept
local LIMIT_BACKOFF_S = 30

local function now()
  local time = redis.call('TIME')
  return tonumber(time[1]) + tonumber(time[2]) / 1e6
end

local function text(number) return string.format('%.6f', number) end
local function job(id) return P .. 'job:' .. id end
local function get(id, field) return redis.call('HGET', job(id), field) end
local function files_of(id) return 'jobs/' .. id .. '/' end

local function event(id)
  local fields = redis.call('HMGET', job(id), 'status', 'stage', 'progress', 'attempt')
  redis.call('XADD', P .. 'events:' .. id, 'MAXLEN', '~', EVENTS, '*', 'status', fields[1], 'stage', fields[2],
    'progress', fields[3], 'attempt', fields[4], 'at', text(now()))
end

-- A job is in: its tenant's index and, until it ends, the tenant's active set and its queue.
local function add(id, queue, tenant, kind, due)
  redis.call('ZADD', P .. 'index:' .. tenant .. ':' .. kind, 0, id)
  redis.call('SADD', P .. 'active:' .. tenant .. ':' .. kind, id)
  redis.call('ZADD', P .. 'queued:' .. queue, text(due), id)
end

local function count(kind, outcome) redis.call('HINCRBY', P .. 'outcomes', kind .. '|' .. outcome, 1) end

local BUCKETS = {0.1, 0.3, 1, 3, 10, 30, 100, 300, 1000}
local function observe(kind, stage, seconds)
  local key = P .. 'stages'
  for _, bound in ipairs(BUCKETS) do
    if seconds <= bound then redis.call('HINCRBY', key, kind .. '|' .. stage .. '|' .. bound, 1) end
  end
  redis.call('HINCRBY', key, kind .. '|' .. stage .. '|count', 1)
  redis.call('HINCRBYFLOAT', key, kind .. '|' .. stage .. '|sum', text(seconds))
end

-- The attempt is the fence: only the run that holds the newest one may change a running job.
local function holds(id, attempt) return get(id, 'status') == 'running' and get(id, 'attempt') == attempt end

local function let_go(id)
  redis.call('HDEL', job(id), 'token', 'worker', 'suspect')
  redis.call('ZREM', P .. 'running', id)
  redis.call('ZREM', P .. 'queued:' .. get(id, 'queue'), id)
end

local function discard(prefix, after)
  redis.call('ZADD', P .. 'garbage', text(now() + after), prefix)
end

local function forget_digest(id)
  local key = P .. 'digest:' .. get(id, 'tenant') .. ':' .. (get(id, 'digest') or '')
  if redis.call('GET', key) == id then redis.call('DEL', key) end
end

-- A job and what is kept of it go; its files wait for the sweep. → ids of its children
local function forget(id)
  local children = redis.call('SMEMBERS', P .. 'children:' .. id)
  if redis.call('EXISTS', job(id)) == 1 then
    local kind, tenant = get(id, 'kind'), get(id, 'tenant')
    let_go(id)
    forget_digest(id)
    redis.call('SREM', P .. 'active:' .. tenant .. ':' .. kind, id)
    redis.call('ZREM', P .. 'index:' .. tenant .. ':' .. kind, id)
    redis.call('ZREM', P .. 'expiry', id)
    local parent = get(id, 'parent')
    if parent then redis.call('SREM', P .. 'children:' .. parent, id) end
    discard(files_of(id), ZOMBIE_S)
  end
  redis.call('DEL', job(id), P .. 'events:' .. id, P .. 'log:' .. id)
  return children
end

local function announce(id)
  local webhook = get(id, 'webhook')
  local hook = id .. '-webhook'
  if not webhook then return end
  local tenant = get(id, 'tenant')
  local at = now()
  redis.call('HSET', job(hook), 'id', hook, 'kind', 'webhook', 'queue', 'webhooks', 'tenant', tenant,
    'parent', id, 'status', 'queued', 'stage', '', 'progress', '0', 'attempt', '0', 'crashes', '0',
    'created_at', text(at), 'keep_s', get(id, 'keep_s'))
  redis.call('SADD', P .. 'children:' .. id, hook)
  add(hook, 'webhooks', tenant, 'webhook', at)
end

-- A job that has ended is kept for so long from now on, if it is not kept for longer.
local function keep(id, seconds)
  local ends = now() + seconds
  local held = redis.call('ZSCORE', P .. 'expiry', id)
  if held and tonumber(held) < ends then
    redis.call('ZADD', P .. 'expiry', text(ends), id)
    redis.call('HSET', job(id), 'expires_at', text(ends))
  end
end

-- A job that was made from another one keeps that one for as long as it is kept itself; while it waits or runs,
-- `expire` spares both. Webhooks are told of their job, and need nothing of it.
local function keep_parent(id)
  local parent = get(id, 'parent')
  if not parent or parent == '' or get(id, 'kind') == 'webhook' then return end
  keep(parent, tonumber(get(id, 'keep_s')))
end

-- Final states never change: every caller checks that the job is not in one yet.
local function finish(id, status)
  local at = now()
  local kind, tenant = get(id, 'kind'), get(id, 'tenant')
  local ends = at + tonumber(get(id, 'keep_s'))
  local attempt = get(id, 'attempt')
  let_go(id)
  redis.call('HSET', job(id), 'status', status, 'completed_at', text(at), 'expires_at', text(ends))
  redis.call('SREM', P .. 'active:' .. tenant .. ':' .. kind, id)
  redis.call('ZADD', P .. 'expiry', text(ends), id)
  count(kind, status)
  observe(kind, 'total', at - tonumber(get(id, 'created_at')))
  if status ~= 'succeeded' then
    forget_digest(id)
    if attempt ~= '0' then discard(files_of(id) .. attempt .. '/', ZOMBIE_S) end
  end
  keep_parent(id)
  event(id)
  announce(id)
end

-- An attempt is over without a result. Crashes are counted; a job handed back or postponed is not to blame.
local function release(id, delay, crashed, most_crashes, problem)
  discard(files_of(id) .. get(id, 'attempt') .. '/', ZOMBIE_S)
  if crashed then
    local crashes = redis.call('HINCRBY', job(id), 'crashes', 1)
    count(get(id, 'kind'), 'crashed')
    if crashes > most_crashes then
      redis.call('HSET', job(id), 'error', problem)
      finish(id, 'failed')
      return 'failed'
    end
    delay = math.min(LIMIT_BACKOFF_S, delay * 2 ^ (crashes - 1))
  end
  let_go(id)
  redis.call('HSET', job(id), 'status', 'queued', 'stage', '', 'progress', '0')
  redis.call('ZADD', P .. 'queued:' .. get(id, 'queue'), text(now() + delay), id)
  event(id)
  return 'queued'
end
