BEGIN TRANSACTION;
CREATE TABLE arrivals (
	uid VARCHAR NOT NULL, 
	run VARCHAR NOT NULL, 
	at VARCHAR NOT NULL, 
	head VARCHAR, 
	digest VARCHAR, 
	PRIMARY KEY (uid), 
	UNIQUE (run), 
	FOREIGN KEY(run) REFERENCES runs (run)
);
CREATE TABLE blocks (
	run VARCHAR NOT NULL, 
	number INTEGER NOT NULL, 
	rate_hz FLOAT NOT NULL, 
	start_s FLOAT NOT NULL, 
	channels JSON NOT NULL, 
	codec VARCHAR NOT NULL, 
	samples BLOB NOT NULL, 
	PRIMARY KEY (run, number), 
	FOREIGN KEY(run) REFERENCES runs (run)
);
INSERT INTO "blocks" VALUES('20261126-115307-sweep-2f0',0,1000.0,2.57911509636341023114e+01,'["vx", "vy", "supply", "d63"]','palette-zlib/1',X'78011DC13D6B55411006E077DE99DDBDC232C67C8891935CAF85A4B82258885667C0DEC62AB518486161B048914E30D805B54ED2FB07522882160A4202F61636E92D3C8414C6BD3ECF5D0006E0121ADF79F5A6AB011FDFBCBF5203FEF9E3CF951AF0A7EB2F576BC0477FD6C635E0EFF78EC735E08FA62F6ED480FFFEBA3CA9017FF7E4D3A406D54850A92654554B662925B39C2CE55C7299199552722E39E5524668FCE1D92FB7809FBEDDBD6C017F7DE7F69C057CFAFDC79C05FC6463FB8A057C8BABF316F0A5FD2FF316F0A3079B0B16D9542D51A954331181904A55355321A9AA64C9A5582A39A79C88A61C4F4F2E1602BB07E7132C86348034101188003203086604F21F1A69808CA63B5CBFB538F4E84EF79E2F0D3DBAE9B70F57871EDDD645B936F4E88EEE3D5E1E7A747F9FED5F1F7A2A93D18C8DAA30A92AC584A48250508CA488925415E83F9D853A91');
INSERT INTO "blocks" VALUES('20261126-115307-sweep-2f0',1,1000.0,3.29678686719674445275e+01,'["vx", "vy", "supply", "d63"]','palette-zlib/1',X'780175C1C12A44511807F0FFF7FDBF3357E85086A853D8CC6A5616B23B67E109A8290F6065A1B1B497B290079862E505946631DB2952289EC0C29631B95D9271EFECFD7E6B000C80432974971B934544F86DB5A78A88B079DA9B2E22C2493FF3454478FCD99A2922492315101140B4C292DA9896483555D2CC589A40C95FDD3EBF31C1B7760FDF99E0BFB0326082EF74FA0326F8B8B1F7C104FFF2343B64823FDABF1E32C1DF5DCA275396396734473A577335A3596DCC916ACE9C1945501111525551CAEE9B0FA3B984E3F3EF55D4934004320611402A90FFC1A1142E761AF53C22BC9EB5E7F388D0BCE92DE411E160942DE611A1BBBEBD94478A9A124A5552091A692AA452591135A5A908295415FE01AFEE3B63');
INSERT INTO "blocks" VALUES('20261126-115307-sweep-2f0',2,1000.0,4.01445863803007938494e+01,'["vx", "vy", "supply", "d63"]','palette-zlib/1',X'78015DC1314B55711806F0E77D9EF73DC7E1F027E8260AC76E3644C29D0AC4EDBCEED2D292B4B4F8018CC6B62057696AAAA696E60B0DB90451937E02376977F00C155EFF4D61BFDF03000E60095579F9FA4DDF25CAF4EED65A97285F8F4ED7BA44D9DB7D75BB4B94A58BFBD32E513E1D1E4FBB4479347B71A74B94F3EFABEB5D5A05182B45136ADA68C22BD20C6614498FF0F8AB69C35B5465BE71E35289F2E4DBFC5289F2FBD9D38512E5DD1FC01365FBED4778A29C3DDC314F94839373F394423292924734D1844B4151A2D349B947B81B8D926024AAF67876B2B8993878FF6B1D93B47F6015EC1AD87F6081AAFFB07B6F320EE87F1EEEDF1A07F4B31F5F96C701FDF345BB320EE83F6F3E5E1D07897456329AC9483A4D26CA4C261122291A5DA239AF001700361F');
INSERT INTO "blocks" VALUES('20261126-115307-sweep-2f0',3,1000.0,4.20215063631245087103e+01,'["vx", "vy", "supply", "d63"]','palette-zlib/1',X'78015DC12D4C55611807F0FFF3F17E9CCBBBA7800CC6C1EB2538E7AE4537B1E879ECCC62BA594D1464D06C6E62648E0D923A83C5EE0C3A378B1421980816C7088C42F004C7763D5ADCF8FDAE03500013E8D8C1F1C95C71D893672FEAE2B0FEC2ADF9E2B02F9F7ECC17873D1A3DBD581C967F5DE91787BDDBDCEB1787DD1BAE5D2A0E3BFD3A3B280EDB7AF079501CB6387EB8501CCC4C04126166D1A82221841463D41073CE29E7DCABAAAA97538C4134E61E3AF6F20C5087DDDD790B75D8E18D2552876DEC9F923AECEAF236ABC3BEC5DBA20E5B79F353D46193779EAB3AECFDC1B5A00E1BAD7F0FEA29E514830A0B336B4829A6AAAA72ECE49C638C21060D2ACC4C444C604627ED0DF7C7938E8D57BF0798723A0F04FA0BF40F084404FA2FA053BF1E5D9E6A1BD4479B8F2FB40DEAE1EEC7E9B641BD3A4E336D83FAC3CDFBB36DC32242CC42CC2AC4601616288B4A87998585444859495899E90F4AF74049');
CREATE TABLE columns (
	run VARCHAR NOT NULL, 
	name VARCHAR NOT NULL, 
	position INTEGER NOT NULL, 
	numbers BLOB, 
	texts JSON, 
	PRIMARY KEY (run, name), 
	FOREIGN KEY(run) REFERENCES runs (run)
);
INSERT INTO "columns" VALUES('20261126-120212-import-c98','alpha_deg',0,X'000000000000000000000000008056400000000000805640000000000080564000000000008056400000000000000000',NULL);
INSERT INTO "columns" VALUES('20261126-120212-import-c98','beta_deg',1,X'00000000000000000000000000000000000000000080564000000000008066400000000000E070400000000000805640',NULL);
INSERT INTO "columns" VALUES('20261126-120212-import-c98','vx_v',2,X'39D6C56D3400044071AC8BDB680004408F53742497FF0B40AA8251499D000440E25817B7D100F83F39D6C56D34000440',NULL);
INSERT INTO "columns" VALUES('20261126-120212-import-c98','n',3,X'000000000000594000000000000059400000000000005940000000000000594000000000000059400000000000005940',NULL);
INSERT INTO "columns" VALUES('20261126-120212-import-c98','note',4,NULL,'["a", "b", "c", "d", "e", "f"]');
CREATE TABLE dwells (
	run VARCHAR NOT NULL, 
	number INTEGER NOT NULL, 
	n INTEGER NOT NULL, 
	means JSON NOT NULL, 
	stds JSON NOT NULL, 
	PRIMARY KEY (run, number), 
	FOREIGN KEY(run) REFERENCES runs (run)
);
INSERT INTO "dwells" VALUES('20261126-115307-sweep-2f0',0,50,'{"vx": 3.5154549011243126, "vy": 2.5083535406905777, "supply": 5.000003270742445, "d63": 1.380633256969586}','{"vx": 0.0006205574141720414, "vy": 0.0005749091969029483, "supply": 0.0001563161543780303, "d63": 0.00037651323650062527}');
INSERT INTO "dwells" VALUES('20261126-115307-sweep-2f0',1,50,'{"vx": 1.5032800791923273, "vy": 2.4932611713545247, "supply": 5.000085397490611, "d63": 1.380683796506919}','{"vx": 0.0003677584622569995, "vy": 0.0006589116840345848, "supply": 0.00011071627986269234, "d63": 0.00031321794581399355}');
INSERT INTO "dwells" VALUES('20261126-115307-sweep-2f0',2,50,'{"vx": 3.514987410403983, "vy": 2.5000461042414734, "supply": 5.000104349817111, "d63": 1.3806079872009196}','{"vx": 0.0006253948674078186, "vy": 0.0004375456420038558, "supply": 8.656396654107547e-05, "d63": 0.00029720630129949024}');
INSERT INTO "dwells" VALUES('20261126-115307-sweep-2f0',3,50,'{"vx": 3.5152401080906475, "vy": 2.5015243857084624, "supply": 5.000091714932778, "d63": 1.380664844180419}','{"vx": 0.000867613332049006, "vy": 0.0007962667778672538, "supply": 0.00010368840654863947, "d63": 0.0003175437411758461}');
CREATE TABLE events (
	event INTEGER NOT NULL, 
	run VARCHAR NOT NULL, 
	at VARCHAR NOT NULL, 
	what VARCHAR NOT NULL, 
	text VARCHAR NOT NULL, 
	PRIMARY KEY (event), 
	FOREIGN KEY(run) REFERENCES runs (run)
);
INSERT INTO "events" VALUES(1,'20261126-115307-sweep-2f0','2026-11-26T11:53:08.109+00:00','answer mounting','yes');
CREATE TABLE log (
	line INTEGER NOT NULL, 
	run VARCHAR NOT NULL, 
	at VARCHAR NOT NULL, 
	clock_s FLOAT NOT NULL, 
	who VARCHAR NOT NULL, 
	what VARCHAR NOT NULL, 
	text VARCHAR NOT NULL, 
	PRIMARY KEY (line), 
	FOREIGN KEY(run) REFERENCES runs (run)
);
INSERT INTO "log" VALUES(1,'20261126-115307-sweep-2f0','2026-11-26T11:53:07.833+00:00',7.11287499999999739408e-01,'run','begun','sweep at pose 0');
INSERT INTO "log" VALUES(2,'20261126-115307-sweep-2f0','2026-11-26T11:53:07.934+00:00',7.20839583333333089321e-01,'run','doing','homing alpha');
INSERT INTO "log" VALUES(3,'20261126-115307-sweep-2f0','2026-11-26T11:53:07.989+00:00',7.69294444444444391884e-01,'run','doing','homing beta');
INSERT INTO "log" VALUES(4,'20261126-115307-sweep-2f0','2026-11-26T11:53:08.125+00:00',8.27995833333333597359e-01,'run','asked','mounting: yes');
INSERT INTO "log" VALUES(5,'20261126-115307-sweep-2f0','2026-11-26T11:53:08.362+00:00',4.33091249999999572395e+00,'run','read','level-front-x = 0.0348 deg');
INSERT INTO "log" VALUES(6,'20261126-115307-sweep-2f0','2026-11-26T11:53:08.362+00:00',4.33091249999999572395e+00,'run','read','level-front-y = -0.0483 deg');
INSERT INTO "log" VALUES(7,'20261126-115307-sweep-2f0','2026-11-26T11:53:08.638+00:00',1.43795045138889054925e+01,'run','read','level-back-x = -0.0106 deg');
INSERT INTO "log" VALUES(8,'20261126-115307-sweep-2f0','2026-11-26T11:53:08.638+00:00',1.43795045138889054925e+01,'run','read','level-back-y = 0.0298 deg');
INSERT INTO "log" VALUES(9,'20261126-115307-sweep-2f0','2026-11-26T11:53:08.747+00:00',1.43993031250000154126e+01,'run','doing','moving to alpha 90, beta 0 deg');
INSERT INTO "log" VALUES(10,'20261126-115307-sweep-2f0','2026-11-26T11:53:08.943+00:00',25.2895509636341,'run','doing','holding alpha 90, beta 0 deg');
INSERT INTO "log" VALUES(11,'20261126-115307-sweep-2f0','2026-11-26T11:55:11.330+00:00',2.58914162414118855784e+01,'run','kept','pose 0: 50 samples');
INSERT INTO "log" VALUES(12,'20261126-115307-sweep-2f0','2026-11-26T11:55:11.471+00:00',2.58914162414118855784e+01,'run','doing','moving to alpha 90, beta 180 deg');
INSERT INTO "log" VALUES(13,'20261126-115307-sweep-2f0','2026-11-26T11:55:11.749+00:00',3.24662686719674482556e+01,'run','doing','holding alpha 90, beta 180 deg');
INSERT INTO "log" VALUES(14,'20261126-115307-sweep-2f0','2026-11-26T11:55:11.890+00:00',3.30681339497452242426e+01,'run','kept','pose 1: 50 samples');
INSERT INTO "log" VALUES(15,'20261126-115307-sweep-2f0','2026-11-26T11:55:11.971+00:00',3.30681339497452242426e+01,'run','doing','moving to alpha 90, beta 360 deg');
INSERT INTO "log" VALUES(16,'20261126-115307-sweep-2f0','2026-11-26T11:55:12.209+00:00',39.6429863803008,'run','doing','holding alpha 90, beta 360 deg');
INSERT INTO "log" VALUES(17,'20261126-115307-sweep-2f0','2026-11-26T11:55:12.342+00:00',4.02448516580785735623e+01,'run','kept','pose 2: 50 samples');
INSERT INTO "log" VALUES(18,'20261126-115307-sweep-2f0','2026-11-26T11:55:12.430+00:00',4.02448516580785735623e+01,'run','doing','moving to alpha 90, beta 360 deg');
INSERT INTO "log" VALUES(19,'20261126-115307-sweep-2f0','2026-11-26T11:55:12.725+00:00',4.15199063631245124383e+01,'run','doing','holding alpha 90, beta 360 deg');
INSERT INTO "log" VALUES(20,'20261126-115307-sweep-2f0','2026-11-26T11:55:12.858+00:00',4.21217716409022884232e+01,'run','kept','pose 3: 50 samples');
INSERT INTO "log" VALUES(21,'20261126-115307-sweep-2f0','2026-11-26T11:55:12.918+00:00',4.21217716409022884232e+01,'run','error','Stopped: stopped by SIGINT; `rig resume 20261126-115307-sweep-2f0` goes on where it was');
INSERT INTO "log" VALUES(22,'20261126-115307-sweep-2f0','2026-11-26T11:55:13.109+00:00',4.22713674742356175766e+01,'run','stopped','all stands still');
CREATE TABLE poses (
	run VARCHAR NOT NULL, 
	number INTEGER NOT NULL, 
	alpha_deg FLOAT NOT NULL, 
	beta_deg FLOAT NOT NULL, 
	direction INTEGER NOT NULL, 
	path VARCHAR NOT NULL, 
	mount_deg FLOAT NOT NULL, 
	flip INTEGER NOT NULL, 
	t_s FLOAT NOT NULL, 
	temperature_c FLOAT, 
	excluded VARCHAR, 
	alpha_read_deg FLOAT, 
	beta_read_deg FLOAT, 
	up VARCHAR DEFAULT 'z' NOT NULL, 
	rate_deg_s FLOAT DEFAULT '0' NOT NULL, 
	PRIMARY KEY (run, number), 
	FOREIGN KEY(run) REFERENCES runs (run)
);
INSERT INTO "poses" VALUES('20261126-115307-sweep-2f0',0,90.0,0.0,1,'A+ to B-',0.0,0,4.32254499342966373677e+04,28.3,NULL,NULL,NULL,'z',0.0);
INSERT INTO "poses" VALUES('20261126-115307-sweep-2f0',1,90.0,180.0,1,'A+ to B-',0.0,0,4.32326266520049684897e+04,28.3,NULL,NULL,NULL,'z',0.0);
INSERT INTO "poses" VALUES('20261126-115307-sweep-2f0',2,90.0,360.0,1,'A+ to B-',0.0,0,4.32398033697133068933e+04,28.3,NULL,NULL,NULL,'z',0.0);
INSERT INTO "poses" VALUES('20261126-115307-sweep-2f0',3,90.0,360.0,-1,'B+ to A-',0.0,0,4.32416802896961307862e+04,28.3,NULL,NULL,NULL,'z',0.0);
CREATE TABLE readings (
	run VARCHAR NOT NULL, 
	name VARCHAR NOT NULL, 
	at VARCHAR NOT NULL, 
	value FLOAT NOT NULL, 
	std FLOAT, 
	unit VARCHAR NOT NULL, 
	PRIMARY KEY (run, name), 
	FOREIGN KEY(run) REFERENCES runs (run)
);
INSERT INTO "readings" VALUES('20261126-115307-sweep-2f0','level-front-x','2026-11-26T11:53:08.375+00:00',0.0348,7.36734536843344908416e-04,'deg');
INSERT INTO "readings" VALUES('20261126-115307-sweep-2f0','level-front-y','2026-11-26T11:53:08.376+00:00',-4.82999999999999957145e-02,7.36734536843344908416e-04,'deg');
INSERT INTO "readings" VALUES('20261126-115307-sweep-2f0','level-back-x','2026-11-26T11:53:08.666+00:00',-1.06000000000000017819e-02,1.12546286774227542043e-03,'deg');
INSERT INTO "readings" VALUES('20261126-115307-sweep-2f0','level-back-y','2026-11-26T11:53:08.667+00:00',2.98000000000000035693e-02,1.12546286774227542043e-03,'deg');
CREATE TABLE runs (
	run VARCHAR NOT NULL, 
	kind VARCHAR NOT NULL, 
	procedure VARCHAR NOT NULL, 
	state VARCHAR NOT NULL, 
	settings JSON NOT NULL, 
	bench JSON NOT NULL, 
	identities JSON NOT NULL, 
	configuration VARCHAR NOT NULL, 
	constants JSON NOT NULL, 
	source VARCHAR NOT NULL, 
	created VARCHAR NOT NULL, 
	ended VARCHAR, 
	message VARCHAR, 
	results JSON NOT NULL, 
	uid VARCHAR DEFAULT '' NOT NULL, 
	PRIMARY KEY (run)
);
INSERT INTO "runs" VALUES('20261126-115307-sweep-2f0','poses','sweep','stopped','{"inclinations_deg": [90.0], "step_deg": 180.0, "dwell_s": 0.05, "settle_s": 0.5, "paths": "grid", "reference_every": 0, "face": "up", "pose_list": []}','{"name": "simulated rig", "seed": 1, "instruments": {"alpha": {"driver": "oriental_az", "url": "simulated", "unit": 1, "stream_url": null, "settings": {"steps_per_turn": 18000, "limits_deg": [-400, 400], "speed_deg_s": 30, "acceleration_deg_s2": 60}, "faults": [], "certificate": null, "error_table": null}, "beta": {"driver": "oriental_az", "url": "simulated", "unit": 2, "stream_url": null, "settings": {"steps_per_turn": 18000, "limits_deg": [-400, 400], "speed_deg_s": 30, "acceleration_deg_s2": 60}, "faults": [], "certificate": null, "error_table": null}, "adc": {"driver": "labjack_t7", "url": "simulated", "unit": 1, "stream_url": null, "settings": {"channels": {"vx": 0, "vy": 1, "supply": 2, "d63": 3}, "on_request": {"mx": 4, "my": 5, "mz": 6, "gx": 7, "gy": 8, "gz": 9}, "rate_hz": 1000, "range_v": 10, "power_dio": 0}, "faults": [], "certificate": null, "error_table": null}, "oven": {"driver": "omega_cn7500", "url": "simulated", "unit": 1, "stream_url": null, "settings": {}, "faults": [], "certificate": null, "error_table": null}, "level": {"driver": "dpg2", "url": "simulated", "unit": 1, "stream_url": null, "settings": {}, "faults": [], "certificate": null, "error_table": null}, "positioner": {"driver": "pi_e727", "url": "simulated", "unit": 1, "stream_url": null, "settings": {"axes": {"x": "1", "y": "2", "z": "3"}, "limits_um": [0, 100]}, "faults": [], "certificate": null, "error_table": null}}, "sensor": {"name": "ADXL203", "serial": "simulated", "manufacturer": "", "gravity_m_s2": 9.80131, "filter_corner_hz": 15.07, "latitude_deg": 40.443, "world": {}}, "sensors": {}, "limits": {"temperature_c": [-20.0, 85.0], "overrun_deg": 5.0, "level_deg": 0.3, "results": {}}, "d63": {"curve": {"serial": "SIM-0063", "date": "2026-11-21", "near": [[80.56, 0.1016], [90.08, 0.1783], [100.48, 0.2985], [110.96, 0.4605], [120.37, 0.6406], [130.53, 0.8684], [139.74, 1.1004], [149.22, 1.3587], [159.9, 1.6662], [169.98, 1.965], [180.47, 2.2774], [189.85, 2.5527], [200.05, 2.8426], [210.03, 3.1131], [220.68, 3.3841], [230.12, 3.6071], [239.9, 3.8196], [250.06, 4.0201], [260.15, 4.1981], [270.41, 4.3581], [279.77, 4.4861], [290.71, 4.6147], [300.44, 4.7111]], "far": [[460.06, 4.7412], [500.55, 4.5222], [539.73, 4.2877], [580.29, 4.0375], [620.14, 3.794], [659.64, 3.5609], [700.36, 3.3327], [740.27, 3.1225], [779.77, 2.9282], [820.19, 2.7434], [860.15, 2.5743], [899.75, 2.4192], [939.45, 2.2756], [980.1, 2.1398], [1020.16, 2.0163], [1060.28, 1.902], [1100.38, 1.7964], [1140.6, 1.6984], [1180.29, 1.6089], [1220.04, 1.5256], [1259.85, 1.4482], [1300.7, 1.3745], [1339.71, 1.3089], [1379.87, 1.246], [1420.25, 1.1869], [1459.65, 1.1331], [1501.2, 1.0802], [1540.51, 1.0332], [1579.96, 0.9891], [1619.69, 0.9473], [1659.8, 0.9077], [1700.04, 0.8703], [1739.58, 0.8357], [1780.33, 0.8021], [1820.55, 0.7709], [1859.47, 0.7424], [1899.9, 0.7143], [1940.34, 0.6877], [1979.37, 0.6635]]}, "side": "near", "direction": 1}, "uncertainty": {"repeat_std_deg": null, "tilt_std_deg": null, "mount_std_deg": null, "gravity_std_m_s2": null, "gain_std": null, "offset_std_v": null, "temperature_std_c": null}, "laboratory": {"name": "not stated", "person": "not stated", "role": "head of the laboratory", "email": "", "street": "", "post_code": "", "city": "not stated", "country": "ZZ", "customer": ""}, "lab": null, "certificates": {}, "world": {"preset": "adxl203"}, "folders": {"effects": null, "procedures": null}}','{"alpha": {"model": "Oriental Motor AZ", "serial": "", "firmware": ""}, "beta": {"model": "Oriental Motor AZ", "serial": "", "firmware": ""}, "adc": {"model": "LabJack T7", "serial": "470012345", "firmware": "1.0312"}, "oven": {"model": "Omega CN7500", "serial": "", "firmware": ""}, "level": {"model": "MEAS DPG2", "serial": "123456789", "firmware": "DPL2 V1.8.0"}, "positioner": {"model": "PI E-727", "serial": "0117055412", "firmware": "13.21.00.09"}}','3c5f61180953424d647c1eed3f8d792da6ae6826a83d0c65621d7f504827474d','{"sensor": "ADXL203", "serial": "simulated", "gravity_m_s2": 9.80131, "filter_corner_hz": 15.07, "latitude_deg": 40.443, "approach_deg": 5.0}','simulated rig','2026-11-26T11:53:07.767+00:00','2026-11-26T11:55:13.109+00:00','stopped by SIGINT; `rig resume 20261126-115307-sweep-2f0` goes on where it was','{}','afb9d6c5d2714d4e8fa6fb443a141518');
INSERT INTO "runs" VALUES('20261126-120212-import-c98','poses','import','complete','{"file": "small.csv", "separator": "comma", "columns": {}, "constants": {}}','{}','{}','b0f42c9f201cd2ca6691484700c806cec6af430495a58f50f5c22ae8eb12dbae','{}','../small.csv','2026-11-26T12:02:12.882+00:00','2026-11-26T12:02:12.882+00:00',NULL,'{}','4bb7942b203b4b05bbb7fc6fc8782371');
CREATE TABLE states (
	run VARCHAR NOT NULL, 
	state JSON NOT NULL, 
	PRIMARY KEY (run), 
	FOREIGN KEY(run) REFERENCES runs (run)
);
INSERT INTO "states" VALUES('20261126-115307-sweep-2f0','{"rig": {"clock_s": 42.12177164090229, "world": {"world": {"now_ns": 42111872335, "ticks": 421, "mechanics_ns": 42100000000, "pieces": [[[14.418928125000015, 0.0, 0.0, 60.0], [14.918928125000015, 7.5, 30.0, 0.0], [17.418928125000015, 82.5, 30.0, -60.0], [17.918928125000015, 90.0, 0.0, 0.0], [17.918928125000015, 90.0, 0.0, 0.0]], [[40.916679357823774, 365.0, 0.0, -60.0], [41.205354492418586, 362.5, -17.32050807568868, 60.0], [41.4940296270134, 360.0, 0.0, 0.0], [41.4940296270134, 360.0, 0.0, 0.0], [41.4940296270134, 360.0, 0.0, 0.0]]], "rest_ns": [17918928125, 41494029627], "table_deg": [89.98954351301187, 360.0100284626708], "up": [-0.0005559120198596508, -0.0006652718559270422, 0.9999996241875213], "mount": [[0.9997430502521967, -0.005615464783952824, -0.02196133028060697], [0.005325077776014574, 0.9998979179730849, -0.013258852882866715], [0.02203354304493752, 0.013138500232153327, 0.9996708972419557]], "board": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], "grip_nm": [0.0, 0.0], "carriage": [[[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]], [[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]], [[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]]], "carriage_rest_ns": [0, 0, 0], "seats_nm": [[7.3829158341711585, 6.539788022801417, 5.696660702685195, 4.853533715771303], [-0.23124109749574717, -1.2441175393167527, -2.256993981137758, -3.2698704229587636]], "volts": [3.5154056094212107, 2.5018857387665117], "powered": 1, "powered_ns": -43200000000000, "charged": 1.0, "warmth": {"wander_k": 0.0054958278444954866, "chamber_c": 22.004912648770357, "body_c": 22.004869516776203, "board_k": 5.99800285541699, "package_k": 2.0, "glue_c": 30.002872372193195, "thermocouple_c": 28.30286755069921, "oven_set_c": 22.0048658278534, "oven_running": 0, "oven_integral": 0.0}, "supply_v": 5.000044657065609, "supply_wander_v": 4.4657065609096575e-05, "x": {"flicker_v": [2.317889494253283e-06, 2.5790139625532945e-06, 1.4273894371458315e-06, 3.079736166400056e-06, -5.096836075375323e-06], "walk_v": 0.0, "wander_v": 0.0, "slow_v": 4.307192984977142e-06, "filtered_v": 3.515411195653311, "filtered_ns": 42100506363, "white": 1.1552971020028477, "white_ns": 42100506363, "kept_ns": 1000000, "kept": 0.9096485437810087, "fresh": 0.4153787750921927}, "y": {"flicker_v": [-7.457005200588312e-06, 3.044776146374733e-06, 7.90941136898601e-06, 2.1994082645569385e-06, 2.8581975607978496e-06], "walk_v": 0.0, "wander_v": 0.0, "slow_v": 8.554788140127219e-06, "filtered_v": 2.501894568860826, "filtered_ns": 42100521363, "white": 1.0733547035784583, "white_ns": 42100521363, "kept_ns": 1000000, "kept": 0.9096485437810087, "fresh": 0.4153787750921927}, "pickup_x": {"is_any": 0, "t_ns": 0, "fast_v": [0.0, 0.0, 0.0], "left_v_s": 0.0, "shaken_v": 0.0, "gap_ns": 0, "kept": [0.0, 0.0, 0.0], "fresh_v": [0.0, 0.0, 0.0]}, "pickup_y": {"is_any": 0, "t_ns": 0, "fast_v": [0.0, 0.0, 0.0], "left_v_s": 0.0, "shaken_v": 0.0, "gap_ns": 0, "kept": [0.0, 0.0, 0.0], "fresh_v": [0.0, 0.0, 0.0]}, "earth_deg_s": [0.002880307102236336, 0.0013420089035749516, 0.002712775453569813], "field_ut": [17.07954763948245, 11.664656767033984, -48.14545497695434], "plates": [[1.0, 0.0, 0.0], [0.0069812602979615525, 0.9999756307053947, 0.0], [0.0, -0.00523596383141958, 0.9999862922474267]], "die": [[0.9998522661934347, -0.007145357138614464, -0.01563296706369163], [0.0069803990372037114, 0.9999196531040135, -0.010581179784434321], [0.015707317311820675, 0.010470492238226785, 0.9998218086114921]], "turned_rad": [1.5715691854012275, 6.28392507869951], "turned_ns": 42100000000, "field_v": [-0.7589199484195552, 0.051769954969712456, -0.13948310194048025], "rate_v": [2.502394919657217, 2.4989234296038645, 2.501796740308153], "seat": 0.5, "lid_in": 0.0}, "generators": [{"bit_generator": "PCG64", "state": {"state": 129867130381592089839767161435204895038, "inc": 37820244784906158083616761211378334797}, "has_uint32": 0, "uinteger": 0}, {"bit_generator": "PCG64", "state": {"state": 67377376380635944826502756171625620360, "inc": 231986847983001667667541278771414391591}, "has_uint32": 0, "uinteger": 0}, {"bit_generator": "PCG64", "state": {"state": 212968737351948561943051250972437246817, "inc": 232760123121920101003617058125211310211}, "has_uint32": 0, "uinteger": 0}]}, "servers": [{"alpha": {"plan": {"start_s": 14.418928125000015, "start_deg": 0.0, "target_deg": 90.0, "speed_deg_s": 30.0, "acceleration_deg_s2": 60.0, "stop_s": null}, "referenced": true, "homing": false, "beyond": false, "heard_s": 42.101973029791175, "words": [[125, 0], [88, 0], [89, 0], [90, 0], [91, 1], [92, 0], [93, 4500], [94, 0], [95, 1500], [96, 0], [97, 3000], [98, 0], [99, 3000], [100, 0], [101, 1000], [102, 0], [103, 1]]}, "beta": {"plan": {"start_s": 40.916679357823774, "start_deg": 365.0, "target_deg": 360.0, "speed_deg_s": 30.0, "acceleration_deg_s2": 60.0, "stop_s": null}, "referenced": true, "homing": false, "beyond": false, "heard_s": 42.11187233534673, "words": [[125, 0], [88, 0], [89, 0], [90, 0], [91, 1], [92, 0], [93, 18000], [94, 0], [95, 1500], [96, 0], [97, 3000], [98, 0], [99, 3000], [100, 0], [101, 1000], [102, 0], [103, 1]]}}, {"adc": {}}, {"oven": {"set_point_c": 25.0, "running": false}}, {"level": {"running": false, "next_s": 0.1}}, {"positioner": {"error": 0, "axes": {"commands": {"1": {"start_s": 0.0, "at_um": -0.00013470204353816464, "rate_um_s": 0.0, "amplitude_um": 0.0, "frequency_hz": 0.0, "phase_rad": 0.0, "end_s": 0.0}, "2": {"start_s": 0.0, "at_um": -0.0002152069664291614, "rate_um_s": 0.0, "amplitude_um": 0.0, "frequency_hz": 0.0, "phase_rad": 0.0, "end_s": 0.0}, "3": {"start_s": 0.0, "at_um": 0.002046439074619529, "rate_um_s": 0.0, "amplitude_um": 0.0, "frequency_hz": 0.0, "phase_rad": 0.0, "end_s": 0.0}}, "settled_s": {"1": 0.0, "2": 0.0, "3": 0.0}, "servo": {"1": false, "2": false, "3": false}, "velocity_um_s": {"1": 1000.0, "2": 1000.0, "3": 1000.0}}, "waves": {"tables": {}, "selected": {"1": 0, "2": 0, "3": 0}, "rates": {"1": [1, 0], "2": [1, 0], "3": [1, 0]}, "cycles": {"1": 0, "2": 0, "3": 0}, "until_s": {"1": 0.0, "2": 0.0, "3": 0.0}}, "recorder": {"what": {"1": ["1", 0], "2": ["1", 0], "3": ["1", 0], "4": ["1", 0], "5": ["1", 0], "6": ["1", 0], "7": ["1", 0], "8": ["1", 0]}, "triggers": {"1": 0, "2": 0, "3": 0, "4": 0, "5": 0, "6": 0, "7": 0, "8": 0}, "rate": 1}}}]}, "zero_s": -43199.633783333}');
CREATE INDEX events_of_run ON events (run);
CREATE INDEX log_of_run ON log (run);
COMMIT;
PRAGMA user_version = 7;
