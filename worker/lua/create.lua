-- ARGV: id, tenant, kind, queue, digest, idempotency key, seconds it is kept, most queued, most active of the
-- tenant, then field, value, ... of the record. → {what happened, id}
local id, tenant, kind, queue, digest, key = ARGV[1], ARGV[2], ARGV[3], ARGV[4], ARGV[5], ARGV[6]
if redis.call('EXISTS', job(id)) == 1 then return {'created', id} end  -- the answer to the first call was lost
-- Who is given a known job is promised it as one who is given a new one.
local function kept(known)
  keep(known, tonumber(ARGV[7]))
  keep_parent(known)
  return {'known', known}
end
local key_key = P .. 'idempotency:' .. tenant .. ':' .. key
if key ~= '' then
  local seen = redis.call('GET', key_key)
  if seen then
    local seen_id, seen_digest = string.match(seen, '^(%S+) (%S*)$')
    if redis.call('EXISTS', job(seen_id)) == 1 then
      -- The request, without the software after the dash: a key holds across an upgrade, content is made anew.
      if string.match(seen_digest, '^[^-]*') ~= string.match(digest, '^[^-]*') then return {'conflict', seen_id} end
      return kept(seen_id)
    end
  end
end
local function remember(known)
  if key ~= '' then redis.call('SET', key_key, known .. ' ' .. digest, 'EX', ARGV[7]) end
end
local digest_key = P .. 'digest:' .. tenant .. ':' .. digest
if digest ~= '' then
  local known = redis.call('GET', digest_key)
  if known and redis.call('EXISTS', job(known)) == 1 then
    remember(known)
    return kept(known)
  end
end
local parent = ''
for i = 10, #ARGV, 2 do if ARGV[i] == 'parent' then parent = ARGV[i + 1] end end
-- It was there when the body began to come, and may have been deleted since.
if parent ~= '' and redis.call('EXISTS', job(parent)) == 0 then return {'orphan', ''} end
if redis.call('ZCARD', P .. 'queued:' .. queue) >= tonumber(ARGV[8]) then return {'full', ''} end
if redis.call('SCARD', P .. 'active:' .. tenant .. ':' .. kind) >= tonumber(ARGV[9]) then return {'busy', ''} end
local fields = {}
for i = 10, #ARGV do fields[#fields + 1] = ARGV[i] end
local at = now()
redis.call('HSET', job(id), unpack(fields))
redis.call('HSET', job(id), 'status', 'queued', 'stage', '', 'progress', '0', 'attempt', '0', 'crashes', '0',
  'created_at', text(at))
add(id, queue, tenant, kind, at)
if parent ~= '' then redis.call('SADD', P .. 'children:' .. parent, id) end
keep_parent(id)
redis.call('ZREM', P .. 'garbage', files_of(id))
if digest ~= '' then redis.call('SET', digest_key, id) end
remember(id)
count(kind, 'accepted')
event(id)
return {'created', id}
