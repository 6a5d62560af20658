% A recorded run in Octave (`pkg load netcdf`, Debian's octave-netcdf) or MATLAB: path of the first body, and its trap's pull.
%   octave --eval "file = 'out/single_bead/run.nc'; source docs/recipes/read_run.m"
if exist('OCTAVE_VERSION', 'builtin')
  pkg load netcdf
end
time = ncread(file, 'time');           % s
place = ncread(file, 'position');      % µm; dimensions in reverse: xyz, body, world, frame
force = ncread(file, 'trap_force');    % pN; xyz, trap, world, frame
names = ncread(file, 'body')';          % prims, filled up with zeros
name = strrep(names(1, :), char(0), '');
path = squeeze(place(:, 1, 1, :))';    % frame, xyz
pull = squeeze(force(:, 1, 1, :))';
printf('%s: %d frames to %g s, position in %s\n', name, numel(time), time(end), ncreadatt(file, 'position', 'units'));
printf('standard deviation along x %.4g um, mean pull of the first trap along z %.4g pN\n', std(path(:, 1)), mean(pull(:, 3)));
