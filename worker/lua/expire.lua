-- ARGV: id of a job whose time is over. → ids of its children, to be deleted next; false: one of them is not done yet
-- and needs it, so it is looked at again.
local id = ARGV[1]
for _, child in ipairs(redis.call('SMEMBERS', P .. 'children:' .. id)) do
  local status = get(child, 'status')
  if get(child, 'kind') ~= 'webhook' and (status == 'queued' or status == 'running') then
    local ends = text(now() + ZOMBIE_S)
    redis.call('ZADD', P .. 'expiry', ends, id)
    redis.call('HSET', job(id), 'expires_at', ends)
    return false
  end
end
return forget(id)
