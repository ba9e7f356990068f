% The warm power flow in MATPOWER, one load changed: the peer of `power-flow` in benches/grid.rs.
% Arguments: folder of MATPOWER, case, bus, factor, solves, file `id vm va` to compare with.
% Prints one line of JSON: the times are MATPOWER's own (`et`, the solution without reading and printing).
function matpower_power_flow(folder, casefile, bus, factor, solves, voltages)
  more off;
  here = cd(folder);
  install_matpower(1, 0, 0);
  cd(here);
  best = struct('median_s', inf);
  for legacy = [1 0]
    mpopt = mpoption('verbose', 0, 'out.all', 0, 'pf.tol', 1e-8, 'exp.use_legacy_core', legacy);
    begin = tic;
    first = runpf(loadcase(casefile), mpopt);
    whole = toc(begin);
    if ~first.success, error('MATPOWER found no solution'); end
    now = first;
    at = find(first.bus(:, 1) == bus);
    load_ = first.bus(at, 3:4);
    times = zeros(1, solves);
    for k = 1:solves
      if mod(k, 2), now.bus(at, 3:4) = factor * load_; else, now.bus(at, 3:4) = load_; end
      now = runpf(now, mpopt);
      if ~now.success, error('MATPOWER found no solution'); end
      times(k) = now.et;
    end
    if median(times) < best.median_s
      best = struct('median_s', median(times), 'warm_s', times, 'cold_s', first.et, 'legacy', legacy);
    end
  end
  ours = dlmread(voltages);
  if any(ours(:, 1) ~= first.bus(:, 1)), error('the buses to compare are others'); end
  v = first.bus(:, 8) .* exp(1j * pi / 180 * first.bus(:, 9));
  best.difference_pu = max(abs(ours(:, 2) .* exp(1j * ours(:, 3)) - v));
  best.version = mpver;
  printf('%s\n', jsonencode(best));
end
