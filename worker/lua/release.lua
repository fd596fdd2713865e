-- ARGV: id, attempt, delay [s], whether it crashed (1, 0), most crashes, error after those, whether it was done and is
-- to be done again (1, or nothing). → new status, or nil.
local id = ARGV[1]
if not holds(id, ARGV[2]) then return nil end
if ARGV[7] == '1' then redis.call('HINCRBY', job(id), 'postponed', 1) end
return release(id, tonumber(ARGV[3]), ARGV[4] == '1', tonumber(ARGV[5]), ARGV[6])
