-- ARGV: id, most lines that are kept, line, ... Of a job that was deleted meanwhile nothing comes back.
local id = ARGV[1]
if redis.call('EXISTS', job(id)) == 0 then return 0 end
local key = P .. 'log:' .. id
for i = 3, #ARGV do redis.call('RPUSH', key, ARGV[i]) end
redis.call('LTRIM', key, -tonumber(ARGV[2]), -1)
return 1
