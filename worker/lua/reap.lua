-- Running jobs whose lease has ended: first suspected, and lost when nobody renewed within the grace. (Not lost at
-- once: after an outage of Redis itself every lease has ended, and every worker is about to renew.)
-- ARGV: grace [s], delay [s], most crashes, error after those. → {id, new status, ...}
local at = now()
local answer = {}
for _, id in ipairs(redis.call('ZRANGEBYSCORE', P .. 'running', '-inf', text(at), 'LIMIT', 0, 100)) do
  local suspect = get(id, 'suspect')
  if not suspect then
    redis.call('HSET', job(id), 'suspect', text(at))
  elseif at - tonumber(suspect) >= tonumber(ARGV[1]) then
    answer[#answer + 1] = id
    answer[#answer + 1] = release(id, tonumber(ARGV[2]), true, tonumber(ARGV[3]), ARGV[4])
  end
end
return answer
