-- ARGV: id. → ids of the children, to be deleted next. Their files and this job's go to the sweep.
local id = ARGV[1]
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
